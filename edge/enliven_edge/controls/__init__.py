"""What a performer or a technician has at hand besides a viewer's keys: pedals, button panels, the voice."""
