"""The engines that roll a scene, one room each, and the registry that knows them."""
