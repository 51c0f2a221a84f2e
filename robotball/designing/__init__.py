"""From requested numbers of the equations to bodies that have them."""
