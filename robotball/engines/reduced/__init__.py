"""The paper's reduced equations: Scene → Motion, and many motions at once by compiled steps."""
