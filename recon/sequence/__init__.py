"""What goes in: the sequence folder (FORMAT.md) and its parts."""
