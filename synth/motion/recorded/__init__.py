"""Recorded motion from BVH files and motion packs."""
