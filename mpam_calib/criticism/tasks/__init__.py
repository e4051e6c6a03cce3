"""Many tasks on one problem: spread over worker processes, and kept in a journal once they are done."""
