"""Command line: parses, loads, calls and prints."""
