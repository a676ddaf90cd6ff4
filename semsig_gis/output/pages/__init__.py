"""Reports as HTML and Markdown pages."""
