"""report.html: what a person looks at first. One page that needs nothing else, opened from the disk."""

from recon.report.page import write_report

__all__ = ["write_report"]
