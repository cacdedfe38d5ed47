"""Where the energy of a run came from and went: an audit of its equations and of its accuracy."""
