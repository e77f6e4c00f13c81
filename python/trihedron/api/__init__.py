"""API: the stages composed. Everything that a person asks for is one function here."""
