"""What a report is made of."""

from typing import Any

Table = tuple[list[str], list[list[str]]]
"""A header, and rows with the same number of cells as the header."""

Block = tuple[str, Any]
"""Kind and content of a block of a report.

The content of title, heading and text is a string; that of figure, video and view (a page in 3D) is a file name, relative to
the report, and a caption; that of table is a Table.
"""
