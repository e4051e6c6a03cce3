"""Self-contained HTML reports: a page shell that every command shares, and the calibration's page."""
