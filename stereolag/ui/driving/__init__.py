"""What the page of whole sequences is made of."""
