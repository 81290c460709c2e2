use super::*;

fn seconds(format: &TimeFormat, cells: &[&str]) -> Vec<f64> {
    let mut last = None;
    let times = cells.iter().map(|cell| {
        let reading = format.kind.read(cell).unwrap_or_else(|| panic!("{cell} is no {}", format.kind));
        last = Some(format.instant_ns(reading, last).unwrap());
        last.unwrap()
    });
    let times: Vec<i128> = times.collect();
    times.iter().map(|ns| (ns - times[0]) as f64 / 1e9).collect()
}

#[test]
fn what_is_plain_is_guessed_and_read() {
    let cases: [(&str, [&str; 2]); 17] = [
        ("iso", ["2026-11-20T22:10:31.5Z", "2026-11-20T22:10:32Z"]),
        ("iso", ["2026-11-20 22:10:31.5", "2026-11-20 22:10:32"]),
        ("iso", ["2026-11-20T22:10:31.5+01:00", "2026-11-20T21:10:32Z"]),
        ("dmy", ["20.11.2026 22:10:31,5", "20.11.2026 22:10:32,0"]),
        ("dmy", ["03.04.2026 22:10:31.5", "03.04.2026 22:10:32"]),
        ("dmy", ["20/11/2026 22:10:31.5", "20/11/2026 22:10:32"]),
        ("dmy", ["20-Nov-2026 22:10:31.5", "20-Nov-2026 22:10:32"]),
        ("mdy", ["11/20/2026 10:10:31.5 PM", "11/20/2026 10:10:32 PM"]),
        ("mdy", ["Nov 20, 2026 22:10:31.5", "Nov 20, 2026 22:10:32"]),
        ("ymd", ["2026/11/20 22:10:31.5 CET", "2026/11/20 21:10:32 UTC"]),
        ("hms", ["22:10:31.5", "22:10:32.0"]),
        ("hms", ["23:59:59,75", "0:00:00,25"]),
        ("epoch s", ["1763676631.5", "1763676632"]),
        ("epoch ms", ["1763676631500", "1763676632000"]),
        ("epoch us", ["1763676631500000", "1763676632000000"]),
        ("epoch ns", ["1763676631500000000", "1763676632000000000"]),
        ("excel", ["45981.923978009259", "45981.923983796296"]),
    ];
    for (name, cells) in cases {
        let format = guess(&cells).unwrap_or_else(|fault| panic!("{cells:?}: {fault}"));
        assert_eq!(format.kind.to_string(), name, "{cells:?}");
        assert_eq!(TimeKind::by_name(name), Some(format.kind.clone()));
        assert!((seconds(&format, &cells)[1] - 0.5).abs() < 1e-5, "{cells:?}");
    }
}

#[test]
fn what_is_not_plain_is_refused() {
    for cells in [["03/04/2026 12:00:00", "03/04/2026 12:00:01"], ["03-04-26 12:00:00", "03-04-26 12:00:01"]]
    {
        assert!(matches!(guess(&cells), Err(TimeFault::DayOrMonth(_))), "{cells:?}");
    }
    assert!(matches!(guess(&["20/11/2026 1:00", "11/20/2026 1:00"]), Err(TimeFault::BothOrders { .. })));
    for cells in [["0.01", "0.02"], ["46000.0", "46000.01"], ["20261120221031", "20261120221032"]] {
        assert!(matches!(guess(&cells), Err(TimeFault::BareNumber(_))), "{cells:?}");
    }
    for cells in
        [["10:31", "10:32"], ["yesterday", "today"], ["20.11.2026 12:00:00 CST", "20.11.2026 12:00:01 IST"]]
    {
        assert!(matches!(guess(&cells), Err(TimeFault::Unknown(_))), "{cells:?}");
    }
}

/// 3 April after 2 April, or 4 March after 4 February.
#[test]
fn a_midnight_settles_the_order() {
    let kind = |cells: &[&str]| guess(cells).map(|format| format.kind.to_string());
    assert_eq!(kind(&["02/04/2026 23:59:59.99", "03/04/2026 00:00:00.00"]).as_deref(), Ok("dmy"));
    assert_eq!(kind(&["04/02/2026 23:59:59.99", "04/03/2026 00:00:00.00"]).as_deref(), Ok("mdy"));
}

#[test]
fn an_hour_that_comes_twice_goes_on() {
    let zone = Zone::by_name("Europe/Berlin");
    assert!(zone.is_some() && Zone::by_name("Europe/Bern").is_none() && Zone::by_name("CST").is_none());
    let format = TimeFormat { kind: TimeKind::Date(DateOrder::DayMonthYear), zone };
    let cells = ["25.10.2026 01:59:59", "25.10.2026 02:59:59", "25.10.2026 02:00:00", "25.10.2026 03:00:00"];
    assert_eq!(seconds(&format, &cells), [0.0, 3600.0, 3601.0, 7201.0]);
    let names = ["2026/10/25 02:59:59 CEST", "2026/10/25 02:00:00 CET"];
    assert_eq!(seconds(&guess(&names).unwrap(), &names), [0.0, 1.0]);
}

#[test]
fn a_pattern_reads_what_no_name_does() {
    let format = TimeFormat { kind: TimeKind::by_name("%Y%m%d-%H%M%S%.f").unwrap(), zone: None };
    assert_eq!(seconds(&format, &["20261120-221031.5", "20261120-221032,75"]), [0.0, 1.25]);
    assert_eq!(format.kind.read("2026"), None);
}

#[test]
fn epochs_keep_their_nanoseconds() {
    assert_eq!(read_epoch("1763676631.123456789", 1_000_000_000), Some(1_763_676_631_123_456_789));
    assert_eq!(read_epoch("-1,5", 1_000), Some(-1_500));
    for text in ["", "-", ".", "1.2.3", "nan", "99999999999999999999", "1e400"] {
        assert_eq!(read_epoch(text, 1_000_000_000), None, "{text}");
    }
}

proptest::proptest! {
    #[test]
    fn any_cell_is_a_time_or_none(text in ".{0,30}", dates in "[0-9]{1,5}[./-][0-9]{1,3}[./-][0-9]{1,5} [0-9:.,]{0,20}") {
        for kind in NAMES.map(|(_, kind)| kind) {
            for text in [&text, &dates] {
                if let Some(reading) = kind.read(text) {
                    let format = TimeFormat { kind: kind.clone(), zone: Zone::by_name("Europe/Berlin") };
                    let _ = format.instant_ns(reading, Some(0));
                }
            }
        }
        let _ = guess(&[&text, &dates]);
    }
}
