"""Manoeuvres: several motions one after the other, where no single one leads on."""
