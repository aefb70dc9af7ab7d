"""What no policy can beat on a given instance."""
