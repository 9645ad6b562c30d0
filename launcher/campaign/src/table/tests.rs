use super::*;

fn table(rows: usize) -> FlightTable {
    let columns =
        [("a.b", ColumnType::Int), ("x", ColumnType::Real), ("why", ColumnType::Text), ("is", ColumnType::Bool)];
    let mut table = FlightTable::new(&columns.map(|(name, kind)| (name.to_owned(), kind)));
    for i in 0..rows {
        let x = if i % 3 == 0 { f64::NAN } else { 1.0 / i as f64 };
        table.push(vec![Cell::Int(i as i64), Cell::Real(x), Cell::Text(format!("row {i}")), Cell::Bool(i % 2 == 0)]);
    }
    table.push(vec![Cell::Int(-1)]);
    table
}

#[test]
fn a_table_comes_back_from_its_file_bit_for_bit() {
    for rows in [0, 5, GROUP + 3] {
        let table = table(rows);
        let bytes = table.to_parquet(&[("index", "3".into())]).unwrap();
        assert_eq!(bytes, table.to_parquet(&[("index", "3".into())]).unwrap(), "the same file again");
        let (read, words) = FlightTable::from_parquet(bytes, u64::MAX).unwrap();
        assert_eq!(read, table);
        assert!(words.contains(&("index".into(), "3".into())));
    }
}

#[test]
fn a_changed_bit_anywhere_is_noticed() {
    let good = table(20).to_parquet(&[]).unwrap();
    let expected = FlightTable::from_parquet(good.clone(), 21).unwrap();
    for at in 0..good.len() {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        // A changed bit is harmless where Parquet ignores it.
        let read = std::panic::catch_unwind(|| FlightTable::from_parquet(bad, 21));
        if let Ok(Ok((read, _))) = read {
            assert_eq!(read, expected.0, "byte {at}");
        }
    }
}

#[test]
fn tables_are_joined_when_they_have_the_same_columns() {
    let mut all = table(3);
    all.append(table(2)).unwrap();
    assert_eq!(all.rows(), 4 + 3);
    assert!(all.append(FlightTable::new(&[])).is_err());
}
