"""What is differentiated, what is a state, what is solved from what: graphs and integers only, never a symbol."""
