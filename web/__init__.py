"""What an operator or a program sees: HTTP, websockets, the 3D view, and the one door that guards
them all."""
