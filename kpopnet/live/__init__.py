"""All people before a depth camera, live: on a page, as a stream of joints, as recordings."""
