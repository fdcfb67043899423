from .tour import TOUR as TOUR, Tour as Tour, Toured as Toured
