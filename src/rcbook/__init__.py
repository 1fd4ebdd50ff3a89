"""Reproducible case studies in repetitive and learning control of machine tools."""

__version__ = "0.1.0"
