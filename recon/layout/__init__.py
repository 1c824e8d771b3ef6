"""Walls, corners, rooms, heights and labels from optimised wall lines."""
