"""The acceptance sheet: a scripted minute before a camera, its figures, and the gates that they are held against."""
