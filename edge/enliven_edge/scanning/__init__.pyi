from .diary import ScanDiary as ScanDiary
from .sheet import sheet_of as sheet_of
