"""Random buildings."""
