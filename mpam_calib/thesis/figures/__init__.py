"""The thesis's figures whose curves survive in its equations and tables, redrawn."""
