"""From a standstill recording to the motor's four parameters: samples and nameplate in, values with covariance and findings out."""
