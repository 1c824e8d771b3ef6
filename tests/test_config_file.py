from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from recon.config import Config, LayoutConfig, VisionConfig
from recon.config_file import load_config, to_toml
from recon.errors import ConfigError


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("config")


@given(
    seed=st.integers(0, 2**62),
    workers=st.integers(1, 64),
    height=st.floats(1e-6, 1e6),
    length=st.floats(1e-9, 1e9),
)
def test_toml_round_trip(folder: Path, seed: int, workers: int, height: float, length: float) -> None:
    config = replace(
        Config(seed=seed, workers=workers),
        layout=LayoutConfig(default_ceiling_height=height),
        vision=VisionConfig(detector="lsd", min_length=length),
    )
    path = folder / "config.toml"
    path.write_text(to_toml(config))
    assert load_config(path) == config


def test_absent_keys_keep_their_defaults(tmp_path: Path) -> None:
    path = tmp_path / "site.toml"
    path.write_text("[layout]\ndefault_ceiling_height = 3\n")
    assert load_config(path) == replace(Config(), layout=LayoutConfig(default_ceiling_height=3.0))


@pytest.mark.parametrize(
    ("text", "fragments"),
    [
        ("seeed = 1", ["seeed", "seed, workers"]),
        ("[lidar]\nmin_pionts = 3", ["lidar.min_pionts", "lidar.min_points"]),
        ("[ladar]\nmin_points = 3", ["ladar", "lidar"]),
        ("lidar = 3", ["lidar", "[lidar]"]),
        ("seed = 1.5", ["seed", "1.5", "int"]),
        ("seed = -1", ["seed", "-1", ">= 0"]),
        ("seed = true", ["seed", "True", "int"]),
        ("workers = 0", ["workers", "0", "> 0"]),
        ("[lidar]\nrange_sigma = nan", ["lidar.range_sigma", "nan"]),
        ("[lidar]\nrange_sigma = '1 cm'", ["lidar.range_sigma", "1 cm", "float"]),
        ("[vision]\ndetector = 'sobel'", ["vision.detector", "sobel", "canny", "lsd"]),
        ("[graph]\nmanhattan = 1", ["graph.manhattan", "1", "bool"]),
        ("seed = ", ["not TOML"]),
    ],
)
def test_refused(text: str, fragments: list[str], tmp_path: Path, run_recon: Any) -> None:
    path = tmp_path / "site.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as error:
        load_config(path)
    for fragment in [str(path), *fragments]:
        assert fragment in str(error.value)
    result = run_recon("build", tmp_path, "-o", tmp_path / "model.usd", "--config", path)
    assert (result.status, result.errors) == (2, [f"recon: {error.value}"])


def test_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: no such file"):
        load_config(tmp_path / "none.toml")
