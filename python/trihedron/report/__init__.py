"""Reports: words, tables and figures of results; laid out once, written as text or as a page."""
