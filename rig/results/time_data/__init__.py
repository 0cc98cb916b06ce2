"""Time records that were measured with other systems."""

from rig.results.kind import ResultKind

KIND = ResultKind(
    name="time-data",
    holds=("identification:TimeRecords",),
    table="rig.results.time_data.views:TABLE",
    draw="rig.results.time_data.views:draw_time_data",
    figure_in=(10.0, 6.4),
    exchange="rig.results.time_data.series:EXCHANGE",
    exported="rig.results.time_data.series:series_of_records",
)
