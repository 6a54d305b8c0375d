from .segment_momentum import FlightMomentum, Normalisation, SegmentMomentum, segment_momentum

__all__ = ["FlightMomentum", "Normalisation", "SegmentMomentum", "segment_momentum"]
