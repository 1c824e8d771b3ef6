"""report.html: what a person looks at first. One page that needs nothing else, opened from the disk."""

from recon.report.page import report, write_report

__all__ = ["report", "write_report"]
