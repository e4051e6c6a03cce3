"""From single effects to sets of causes: which are tried, and how one's fit leads to another's."""
