"""Published metrics of a result against ground truth."""
