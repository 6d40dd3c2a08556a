"""The dance teacher: a local page that shows a dance, watches a learner through a depth camera and says how it goes."""
