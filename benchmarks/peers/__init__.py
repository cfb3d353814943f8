"""Other programs, measured on the same work where they are installed."""
