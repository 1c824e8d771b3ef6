"""Programs and libraries that open what recon writes: what each of them says about a file."""

from recon.clients.check import check_file
from recon.clients.finding import Finding

__all__ = ["Finding", "check_file"]
