"""The ball as a contact model: MJCF composed, stepped, read and watched."""
