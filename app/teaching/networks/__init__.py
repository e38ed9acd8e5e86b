"""Versions of the network, and the exchange of the one in use."""
