"""The equations of any robot that rolls, and their integration."""
