"""What is entered in the ledger, one module for each part of the thesis."""
