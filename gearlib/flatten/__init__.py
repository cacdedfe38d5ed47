"""From a tree of components to flat equations: instances, connection sets, aliases, parameter values."""
