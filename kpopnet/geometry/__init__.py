"""Geometry that both trackers share: bone lengths, body parts as round cones, a coarse grid over the depth image."""
