"""Published metrics of a result against ground truth."""

from recon.evaluate.evaluation import Evaluation, evaluate

__all__ = ["Evaluation", "evaluate"]
