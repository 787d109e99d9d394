"""What recordings and test sheets of many motors are taken for: scale errors against plates, bars of a rotor."""
