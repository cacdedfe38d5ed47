"""What a run cannot be: input jumps that are differentiated, values below their least, and which equation is to blame."""
