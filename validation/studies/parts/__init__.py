"""What each modelled thing costs a step."""
