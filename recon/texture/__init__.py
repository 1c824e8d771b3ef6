"""Faces, view choice, rectification, blending, filling."""
