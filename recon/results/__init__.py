"""The result folder: written whole, and read back so that every export can be made again."""

from recon.results.reader import load_model
from recon.results.writer import save_result

__all__ = ["load_model", "save_result"]
