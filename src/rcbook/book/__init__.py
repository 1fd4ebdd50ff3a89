"""Execute the notebooks, judge the claims, render the book."""
