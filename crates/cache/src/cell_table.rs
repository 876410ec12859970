//! From a cell's key to its list of records: a hash table with open addressing.
//! Its hash is a fixed one, so that the index is the same in every run.

/// An occupied cell: `len` records from `start` in the octree's lists. A free place in the table has `len` 0.
#[derive(Clone, Copy, Debug, Default)]
struct Cell {
    key: u64,
    start: u32,
    len: u32,
}

/// The occupied cells of one level.
#[derive(Clone, Debug)]
pub(crate) struct CellTable {
    /// A power of two of places, at least twice as many as occupied cells.
    places: Vec<Cell>,
    n_cells: usize,
}

impl CellTable {
    pub(crate) fn new() -> Self {
        Self {
            places: vec![Cell::default(); 16],
            n_cells: 0,
        }
    }

    /// Counts one more record in a cell; true if it is the cell's first.
    pub(crate) fn count(&mut self, key: u64) -> bool {
        if self.n_cells * 2 >= self.places.len() {
            self.grow();
        }
        let place = self.place(key);
        let cell = &mut self.places[place];
        cell.key = key;
        cell.len += 1;
        let is_first = cell.len == 1;
        self.n_cells += usize::from(is_first);
        is_first
    }

    /// Sets where the list of an occupied cell starts; returns where it ends.
    pub(crate) fn set_start(&mut self, key: u64, start: u32) -> u32 {
        let place = self.place(key);
        let cell = &mut self.places[place];
        cell.start = start;
        start + cell.len
    }

    /// The next place in the cell's list while lists are being filled; [`CellTable::end_filling`] comes after the last.
    pub(crate) fn next_in_list(&mut self, key: u64) -> u32 {
        let place = self.place(key);
        let next = &mut self.places[place].start;
        *next += 1;
        *next - 1
    }

    /// Takes back what [`CellTable::next_in_list`] did to the starts of all lists; each must have been filled.
    pub(crate) fn end_filling(&mut self) {
        for cell in &mut self.places {
            cell.start -= cell.len;
        }
    }

    /// Start and length of the cell's list; length 0 for a cell without records.
    #[inline]
    pub(crate) fn list(&self, key: u64) -> (u32, u32) {
        let cell = self.places[self.place(key)];
        (cell.start, cell.len)
    }

    /// The place that holds `key`, or the free one where it would go.
    #[inline]
    fn place(&self, key: u64) -> usize {
        let mask = self.places.len() - 1;
        // Fibonacci hashing (Knuth, TAOCP 3, §6.4): the odd number nearest to 2⁶⁴/φ spreads consecutive keys.
        let hash = key.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        let mut place = (hash >> 32) as usize & mask;
        // Ends: at most half of the places are taken.
        loop {
            let cell = self.places[place];
            if cell.len == 0 || cell.key == key {
                return place;
            }
            place = (place + 1) & mask;
        }
    }

    fn grow(&mut self) {
        let places = vec![Cell::default(); self.places.len() * 2];
        for cell in std::mem::replace(&mut self.places, places) {
            if cell.len > 0 {
                let place = self.place(cell.key);
                self.places[place] = cell;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_counted_cell_is_found_and_no_other() {
        let keys = |i: u64| i * 7_919 + ((i % 5) << 42);
        let mut table = CellTable::new();
        for i in 0..10_000 {
            assert!(table.count(keys(i)));
            assert!(!table.count(keys(i)));
        }
        let mut start = 0;
        for i in 0..10_000 {
            start = table.set_start(keys(i), start);
        }
        assert_eq!(start, 20_000);
        for i in 0..10_000 {
            assert_eq!(table.next_in_list(keys(i)), 2 * i as u32);
            assert_eq!(table.next_in_list(keys(i)), 2 * i as u32 + 1);
        }
        table.end_filling();
        for i in 0..10_000 {
            assert_eq!(table.list(keys(i)), (2 * i as u32, 2));
            assert_eq!(table.list(keys(i) + 1).1, 0);
        }
    }
}
