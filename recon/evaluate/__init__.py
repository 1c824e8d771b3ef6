"""Published metrics of a result against ground truth."""

from recon.evaluate.evaluation import Evaluation, confusion_pictures, evaluate
from recon.evaluate.plot import plot_result

__all__ = ["Evaluation", "confusion_pictures", "evaluate", "plot_result"]
