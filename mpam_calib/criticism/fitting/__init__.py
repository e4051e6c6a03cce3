"""One hypothesis, refitted exactly: its forms, the doubt about these, its evidence."""
