"""Scenes of any number of people among clutter, before any camera: what the finder of people is trained and judged on."""
