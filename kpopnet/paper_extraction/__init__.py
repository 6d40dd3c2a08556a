"""The paper's human extraction (section 2.1, Algorithm 1)."""

from kpopnet.paper_extraction.algorithm1 import PaperExtractionConfig, PaperExtractor

__all__ = ["PaperExtractionConfig", "PaperExtractor"]
