"""Forms of the equations that IDA is handed."""
