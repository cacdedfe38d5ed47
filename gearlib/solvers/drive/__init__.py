"""The driver of all runs: samples, events, time events and the event log, independent of the stepper."""
