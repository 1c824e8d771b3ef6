"""Published metrics of a result against ground truth."""

from recon.evaluate.evaluation import Evaluation, evaluate
from recon.evaluate.plot import plot_result

__all__ = ["Evaluation", "evaluate", "plot_result"]
