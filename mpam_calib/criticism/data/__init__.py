"""The data as every hypothesis sees them: reduced rows, the raw readings behind them, and their noise."""
