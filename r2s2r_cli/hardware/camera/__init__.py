"""RGB-D cameras: one interface (`devices.camera.Camera`), and what can stand behind it."""
