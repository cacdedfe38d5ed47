"""One driver of all runs: samples, events, time events and the event log, whatever method takes the steps."""
