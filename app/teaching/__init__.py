"""Teaching the network a new class from the console: capture, annotation, training, exchange."""
