"""Stamps of imagined loggers, drawn without a look at what reads them."""
